"""Contacts in an external effort: detection, forces against a force sensor, and the mass of a load."""
