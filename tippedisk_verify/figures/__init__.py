"""The figures.

`style` is common to all of them. Each other module has drawings, and the report's exhibits made of
them. An exhibit (`exhibit`) is a figure with its data and a line that explains it;
`exhibit_catalogue` lists them. Matplotlib is imported only in this package, and only when something
is drawn.
"""
