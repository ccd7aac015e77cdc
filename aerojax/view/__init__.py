"""What a person looks at: report pages and plots."""
