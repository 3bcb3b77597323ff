"""The grasp-transition paper's tables, and what its backbones cost."""
