"""Many pieces of one structure side by side: a lane each."""
