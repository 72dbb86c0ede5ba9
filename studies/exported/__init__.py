"""What the study of exported robots is made of: logs, roads to torque, and a drive."""
