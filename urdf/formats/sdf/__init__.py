"""SDF, the format of Gazebo: a graph of links and joints, read and written without sdformat."""
