"""What an external effort says of contacts: how large it is where nothing touches the robot, and within windows."""
