"""The force at the tip, from the external efforts of three joints, and beside that of a force sensor."""
