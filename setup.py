"""Lists the packages (everything below stc/, validate/, models/ and specs/, under the one name ``stc``) and compiles
the solver's own machine code, so that nobody has to wait for it at the first solve."""

import os
import subprocess
import sys
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

FOLDERS = {"stc": "stc", "stc.validate": "validate", "stc.models": "models", "stc.specs": "specs"}


class BuildWithMachineCode(build_py):
    """Copies the package, and has it compile its own code beside it (in a checkout: in place)."""

    def run(self) -> None:
        super().run()
        root = Path(__file__).parent if self.editable_mode else Path(self.build_lib)
        paths = [str(root.resolve()), *filter(None, [os.environ.get("PYTHONPATH")])]
        done = subprocess.run(
            [sys.executable, "-B", "-m", "stc.compile_ahead", "stc/codegen/shipped_objects"],
            cwd=root,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            check=False,
        )
        if done.returncode:
            print("the package goes without machine code of its own, and compiles it when it is first used")


setup(
    cmdclass={"build_py": BuildWithMachineCode},
    packages=[
        name
        for package, folder in FOLDERS.items()
        for name in (package, *(f"{package}.{below}" for below in find_packages(folder)))
    ],
)
