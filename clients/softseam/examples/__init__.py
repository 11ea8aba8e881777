"""Programs to begin with; a test runs each of them."""
