"""The maps of the atlas, one a file."""
