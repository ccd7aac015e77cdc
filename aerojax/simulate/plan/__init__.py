"""What is in a data set and in each of its sequences, before anything is made."""
