"""The device side: everything that runs inside a launch, one module for each piece of the physics.

Imported as `warpsph.kernels` and under no other name. This folder also lies at the top of the repository, so that
`import kernels` would find it from there and bring a second copy of every module and of every struct to life; kernels
of one copy refuse the structs of the other. Hence the guard.
"""

if __name__ != "warpsph.kernels":
    raise ImportError(f"this package is imported as 'warpsph.kernels', not as '{__name__}'")
