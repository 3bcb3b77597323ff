"""The operator's page: what a person keeps open in a browser beside a moving gripper."""
