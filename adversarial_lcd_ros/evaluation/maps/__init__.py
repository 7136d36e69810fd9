"""What the closures of a replay do to the map: many draws, back ends, pictures."""
