"""What is done about a decision: alarms, grippers, arms, and the interlock before them."""
