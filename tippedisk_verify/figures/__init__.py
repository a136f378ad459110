"""Pictures. `style` is what all share; each other module has drawings, and the exhibits of the report made of them.

An exhibit (`exhibit`) is a figure with all that belongs to it: what is computed for it, its data, and one line that
says what to see. `catalogue` lists them. Matplotlib is imported here only, and only when something is drawn.
"""
