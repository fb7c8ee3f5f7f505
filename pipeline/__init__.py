"""Contact forces of a da Vinci arm from its motor currents, offline: from raw logs to reports."""
