"""The final state of random clamps, against a search that knows neither gradients nor multipliers."""
