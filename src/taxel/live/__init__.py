"""The live path: the stages joined."""
