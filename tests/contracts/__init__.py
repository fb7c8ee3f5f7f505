"""What must hold of every member of an extension folder, one module a folder: each runs over the folder's own list."""
