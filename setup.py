"""Lists the packages (everything below stc/, validate/, models/ and specs/, under the one name ``stc``), compiles the
numerical core, which is C, and the solver's own machine code, so that nobody has to wait for it at the first solve."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

FOLDERS = {"stc": "stc", "stc.validate": "validate", "stc.models": "models", "stc.specs": "specs"}


class BuildWithMachineCode(build_py):
    """Copies the package, and has it compile its own code beside it (in a checkout: in place)."""

    def run(self) -> None:
        super().run()
        here = Path(__file__).parent
        root = here if self.editable_mode else Path(self.build_lib)
        compiling = runpy.run_path(str(here / "stc/core/compiling.py"))
        try:
            compiling["compile_library"](root.resolve() / "stc/core", here / "build/core")
        except (RuntimeError, OSError) as error:
            print(
                f"the package goes without its numerical core, and solves bodies in space by slower means: {error}"
            )
        paths = [str(root.resolve()), *filter(None, [os.environ.get("PYTHONPATH")])]
        done = subprocess.run(
            [sys.executable, "-B", "-m", "stc.compile_ahead", "stc/codegen/shipped_objects"],
            cwd=root,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            check=False,
        )
        if done.returncode:
            print("the package goes without machine code of its own, and compiles it when it is first used")


class WithCore(Distribution):
    """A distribution for one kind of machine, though it has no extension modules."""

    def has_ext_modules(self) -> bool:
        return True


class PlatformWheel(bdist_wheel):
    """One wheel a platform, for all versions of Python: the core is loaded through ctypes."""

    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", super().get_tag()[2]


setup(
    distclass=WithCore,
    cmdclass={"build_py": BuildWithMachineCode, "bdist_wheel": PlatformWheel},
    packages=[
        name
        for package, folder in FOLDERS.items()
        for name in (package, *(f"{package}.{below}" for below in find_packages(folder)))
    ],
)
