"""Contact methods on one scene with known answers: accuracy against time."""
