"""Weak forms in contact mechanics from Python: scenes, runs, and results as numpy arrays.

>>> import wfl
>>> scene = wfl.Scene("fault.wfl", gamma=1e5)
>>> result = scene.run()
>>> result["uL"], result.measures["Fn"], result.contact("fault").slip

A scene is a text file (its language is described in docs/language.md). Its numbers have no units of their own: those of
results are those of the scene, consistently; shapes are given at each function. The numbers are, bit for bit, those of the
command ``wfl run``, which this package carries, too.
"""

from ._messages import Message, WflError, WflWarning
from ._result import Charts, Contact, Iteration, Result, Step
from ._scene import Field, Scene
from ._wfl import State
from ._wfl import version as __version__

__all__ = [
    "Charts",
    "Contact",
    "Field",
    "Iteration",
    "Message",
    "Result",
    "Scene",
    "State",
    "Step",
    "WflError",
    "WflWarning",
    "__version__",
]
