"""Programs that need more than the client; a test runs each of them."""
