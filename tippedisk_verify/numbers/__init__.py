"""Numbers: exact inputs, arithmetics of any precision, and results with half-widths.

- `exact`: numbers and texts as exact inputs;
- `decimals`: exact numbers as decimal text;
- `precision`: the arithmetics, from doubles to any number of bits;
- `measured`: a number with its half-width;
- `arrays`: arrays of doubles from numbers of any kind;
- `numpy_errors`: results that do not depend on the caller's NumPy error state.
"""
