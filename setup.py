"""Lists the packages (everything below stc/, validate/, models/ and specs/, under the one name ``stc``), and compiles
the numerical core, which is C."""

import runpy
import sys
from pathlib import Path

from setuptools import Distribution, find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent  # where a checkout keeps what it has compiled
COMPILING = runpy.run_path(str(HERE / "stc/core/compiling.py"))
FOLDERS = {"stc": "stc", "stc.validate": "validate", "stc.models": "models", "stc.specs": "specs"}


class BuildWithCore(build_py):
    """Copies the package, and compiles its core beside it (in a checkout: in place)."""

    def run(self) -> None:
        super().run()
        root = HERE if self.editable_mode else Path(self.build_lib)
        scratch = HERE / "build/core" / (COMPILING["wanted_platform"]() or "")
        try:
            COMPILING["compile_libraries"](root.resolve() / "stc/core", scratch)
        except (RuntimeError, OSError) as error:
            sys.exit(
                f"{error}\nThe numerical core of this package is C, and could not be compiled. It needs a C compiler "
                "(GCC 12, Clang 15 or later, found as cc or named by CC), or the package ziglang, which pip fetches by "
                "itself where it may."
            )


class WithCore(Distribution):
    """A distribution for one kind of machine, though it has no extension modules."""

    def has_ext_modules(self) -> bool:
        return True


class PlatformWheel(bdist_wheel):
    """One wheel a platform, for all versions of Python: the core is loaded through ctypes."""

    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", COMPILING["wanted_platform"]() or super().get_tag()[2]


setup(
    distclass=WithCore,
    cmdclass={"build_py": BuildWithCore, "bdist_wheel": PlatformWheel},
    packages=[
        name
        for package, folder in FOLDERS.items()
        for name in (package, *(f"{package}.{below}" for below in find_packages(folder)))
    ],
)
