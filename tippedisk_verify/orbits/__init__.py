"""What the flow organises into: scenes, limit cycles, connections. Every function takes the engine to use."""
