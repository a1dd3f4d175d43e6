"""How robots and people move, and what wheel odometry tells of it."""
