"""Work side by side: in processes of this machine, or on engines that others run."""
