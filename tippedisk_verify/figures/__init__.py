"""The figures.

`style` is common to all of them. An exhibit (`exhibit`) is a figure of the audit's report, with its
data and a line that explains it; `exhibit_catalogue` lists them. Matplotlib is imported only when
something is drawn, here or by a result that plots itself.
"""
