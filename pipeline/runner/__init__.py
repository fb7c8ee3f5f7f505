"""What runs again, and why: planning a study's tasks, running them, and remembering what each was made from."""
