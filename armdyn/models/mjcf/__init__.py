"""Arms that are described in MuJoCo's format, MJCF: read within bounds, and handed to Pinocchio's own parser."""
