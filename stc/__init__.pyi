# The types of the names that `stc/__init__.py` imports when they are first used.
from stc.errors import Diagnostic as Diagnostic
from stc.errors import EndedError as EndedError
from stc.errors import EvaluationError as EvaluationError
from stc.errors import SolutionError as SolutionError
from stc.errors import SpecError as SpecError
from stc.errors import StcError as StcError
from stc.errors import UsageError as UsageError
from stc.pipeline import Model as Model
from stc.pipeline import load as load
from stc.solution import Solution as Solution
from stc.solution import read as read
from stc.sweeps import sweep as sweep
from stc.version import __version__ as __version__
