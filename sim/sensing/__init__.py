"""What a lidar measures of a world: noise, effects, and which corners a scan shows."""
