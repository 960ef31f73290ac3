"""Lists the packages: everything below stc/, validate/, models/ and specs/, under the one name ``stc``."""

from setuptools import find_packages, setup

FOLDERS = {"stc": "stc", "stc.validate": "validate", "stc.models": "models", "stc.specs": "specs"}

setup(
    packages=[
        name
        for package, folder in FOLDERS.items()
        for name in (package, *(f"{package}.{below}" for below in find_packages(folder)))
    ]
)
