"""What is asked of a mechanism: mobility, velocity, singularities, redundancy, maps.

The public names are those of ``closedchain``; here every module stands for itself.
"""

if __name__ != "closedchain.analysis":
    raise ImportError(
        "import closedchain.analysis, not analysis: two copies of a class never match"
    )
