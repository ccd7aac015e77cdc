"""Where messages go: lines of JSON, a page with metrics, brokers."""
