"""A cup between two gels that is filled: dynamics, friction and shear; pure physics."""
