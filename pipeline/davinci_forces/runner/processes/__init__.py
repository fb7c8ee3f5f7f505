"""Where tasks run: in other processes of this machine, or of a cluster, which reckon as this one does."""
