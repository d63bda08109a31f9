"""Problem and plan files: read, checked by key, and written."""
