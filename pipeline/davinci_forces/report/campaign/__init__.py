"""Many studies on one page: their numbers over time, what of them drifts or stands out, and the page itself."""
