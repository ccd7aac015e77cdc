"""What every room uses: values that cross stages, errors, configuration, colour, files, seeds."""
