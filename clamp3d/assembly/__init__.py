"""Connection matrix, sequence, screw joint, motion and final state."""
