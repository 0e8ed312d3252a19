"""Closure equations as straight-line arithmetic: written once, run on any kind of number."""

if __name__ != "closedchain.closure.tape":
    raise ImportError("import closedchain.closure.tape: two copies of a class never match")
