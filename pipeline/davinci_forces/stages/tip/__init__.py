"""Compute the force at the tip from the external efforts of three joints, and compare it with a force sensor."""
