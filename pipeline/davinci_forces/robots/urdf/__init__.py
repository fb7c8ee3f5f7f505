"""Read and write robots as URDF, the robot description of ROS and of simulators."""
