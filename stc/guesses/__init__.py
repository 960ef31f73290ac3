"""Starting values from outside: tables and earlier solutions, from files or by name, at the frames of a motion."""
