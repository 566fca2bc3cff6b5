# SPDX-License-Identifier: Apache-2.0
"""The provider of QGIS: in qgis_process where that is installed (200 packages), and everywhere with classes in place of
qgis.core that hold what a plugin gives them. The names and the order of their arguments are those of QGIS 3.16's
documentation."""
import configparser
import importlib
import os
import pathlib
import shutil
import subprocess
import sys
import types

import numpy as np
import pytest
from clouds import waves, write_ply

import pointfair as pf

FOLDER = pathlib.Path(__file__).parents[2] / "examples/qgis"


class Parameter:
    Double = 1

    def __init__(self, name, description="", type=None, defaultValue=None, optional=False, minValue=None, maxValue=None):
        self.name, self.default, self.optional = name, defaultValue, optional


class File(Parameter):
    def __init__(self, name, description="", behavior=0, extension="", defaultValue=None, optional=False, fileFilter=""):
        super().__init__(name, defaultValue=defaultValue, optional=optional)


class FileDestination(Parameter):
    def __init__(self, name, description="", fileFilter="", defaultValue=None, optional=False, createByDefault=True):
        super().__init__(name, defaultValue=defaultValue, optional=optional)


class Text(Parameter):
    def __init__(self, name, description="", defaultValue=None, multiLine=False, optional=False):
        super().__init__(name, defaultValue=defaultValue, optional=optional)


class Enum(Parameter):
    def __init__(self, name, description="", options=(), allowMultiple=False, defaultValue=None, optional=False):
        super().__init__(name, defaultValue=defaultValue, optional=optional)


class Algorithm:
    def addParameter(self, parameter):
        vars(self).setdefault("parameters", {})[parameter.name] = parameter

    def addOutput(self, output):
        vars(self).setdefault("outputs", []).append(output.name)

    def value(self, parameters, name, context):
        return parameters.get(name, self.parameters[name].default)

    def parameterAsDouble(self, *words):
        return float(self.value(*words))

    def parameterAsString(self, *words):
        return str(self.value(*words) or "")

    parameterAsFile = parameterAsFileOutput = parameterAsString

    def parameterAsEnum(self, *words):
        return int(self.value(*words))


class Provider:
    def addAlgorithm(self, algorithm):
        algorithm.initAlgorithm()
        vars(self).setdefault("algorithms", {})[algorithm.name()] = algorithm


class Registry:
    providers = {}

    def addProvider(self, provider):
        provider.loadAlgorithms()
        self.providers[provider.id()] = provider

    def removeProvider(self, provider):
        del self.providers[provider.id()]


class Feedback:
    def __init__(self, cancel_at=2.0):
        self.cancel_at, self.shares, self.told, self.warned = 100 * cancel_at, [], [], []
        self.setProgress, self.pushInfo, self.pushWarning = self.shares.append, self.told.append, self.warned.append

    def isCanceled(self):
        return self.shares[-1] >= self.cancel_at


class ProcessingException(Exception):
    pass


@pytest.fixture
def denoise(monkeypatch):
    """The algorithm, as the registry holds it once the plugin is loaded."""
    core = types.ModuleType("qgis.core")
    kinds = {"File": File, "FileDestination": FileDestination, "String": Text, "Enum": Enum, "Number": Parameter}
    for name, kind in kinds.items():
        setattr(core, f"QgsProcessingParameter{name}", kind)
    core.QgsProcessingOutputNumber, core.QgsProcessingException = Parameter, ProcessingException
    core.QgsProcessingAlgorithm, core.QgsProcessingProvider = Algorithm, Provider
    core.QgsApplication = types.SimpleNamespace(processingRegistry=Registry)
    monkeypatch.setitem(sys.modules, "qgis", types.ModuleType("qgis"))
    monkeypatch.setitem(sys.modules, "qgis.core", core)
    monkeypatch.syspath_prepend(str(FOLDER))
    plugin = importlib.import_module("pointfair_provider").classFactory(None)
    plugin.initProcessing()
    yield Registry.providers["pointfair"].algorithms["denoise"]
    plugin.unload()
    assert not Registry.providers
    for name in [name for name in sys.modules if name.startswith("pointfair_provider")]:
        del sys.modules[name]


@pytest.fixture
def scan(tmp_path):
    write_ply(tmp_path / "scan.ply", waves(3000))
    return str(tmp_path / "scan.ply")


def test_the_output_is_that_of_a_run(denoise, scan, tmp_path):
    feedback = Feedback()
    given = {"INPUT": scan, "NOISE": 0.01, "STRENGTH": 0.5, "OUTLIERS": 1, "OUTPUT": str(tmp_path / "out.ply")}
    result = denoise.processAlgorithm(given, None, feedback)
    expected = pf.read(scan).denoise(noise=0.01, strength=0.5, outliers="keep")
    assert np.array_equal(pf.read(given["OUTPUT"]).xyz, expected.xyz) and not np.array_equal(expected.xyz, pf.read(scan).xyz)
    assert result["OUTPUT"] == given["OUTPUT"] and result["POINTS"] == 3000 and sorted(result)[1:] == denoise.outputs
    assert feedback.shares[-1] == 100 and len(feedback.told) == 1 and not feedback.warned
    assert "0 kept their place; noise 0.01 (given)" in feedback.told[0]


def test_points_that_where_holds_kept_their_place(denoise, tmp_path):
    pf.Cloud(waves(3000), {"part": np.arange(3000, dtype=np.uint8) % 3}).write(tmp_path / "parts.ply")
    given = {"INPUT": str(tmp_path / "parts.ply"), "WHERE": "part=1", "OUTPUT": str(tmp_path / "out.ply")}
    feedback = Feedback()
    unmoved = denoise.processAlgorithm(given, None, feedback)["UNMOVED"]
    before, after = pf.read(given["INPUT"]).xyz, pf.read(given["OUTPUT"]).xyz
    assert 2000 <= unmoved == sum(map(np.array_equal, before, after)) < 2100
    assert f"{unmoved} kept their place" in feedback.told[0] and "(estimated)" in feedback.told[0]


def test_defaults_are_those_of_the_library_and_losses_are_told(denoise, scan, tmp_path):
    cloud = pf.Cloud(waves(3000), {"class": np.arange(3000, dtype=np.uint16)})
    cloud.write(tmp_path / "classes.ply")
    feedback = Feedback()
    denoise.processAlgorithm({"INPUT": str(tmp_path / "classes.ply"), "OUTPUT": str(tmp_path / "out.off")}, None, feedback)
    assert np.allclose(pf.read(tmp_path / "out.off").xyz, pf.denoise(cloud).xyz, atol=1e-6)
    assert len(feedback.warned) == 1 and "class" in feedback.warned[0]


def test_faults_are_one_line_and_cancelling_leaves_no_file(denoise, scan, tmp_path):
    output = tmp_path / "out.ply"
    with pytest.raises(ProcessingException, match="missing.laz"):
        denoise.processAlgorithm({"INPUT": str(tmp_path / "missing.laz"), "OUTPUT": str(output)}, None, Feedback())
    with pytest.raises(ProcessingException, match="where|attribute"):
        denoise.processAlgorithm({"INPUT": scan, "WHERE": "classification=2", "OUTPUT": str(output)}, None, Feedback())
    assert denoise.processAlgorithm({"INPUT": scan, "OUTPUT": str(output)}, None, Feedback(cancel_at=0.1)) == {}
    assert not output.exists()


@pytest.fixture
def qgis_process(tmp_path):
    """Runs qgis_process with the plugin enabled and a folder of its own; returns the ended process."""
    # Debian's script of that name adds an option that the program refuses
    program = shutil.which("qgis_process.bin") or shutil.which("qgis_process")
    if not program:
        pytest.skip("qgis_process is not installed: make test-integrations installs it")
    ask = "import sys; print(*sys.version_info[:2], sep='.')"
    its = subprocess.run([shutil.which("python3", path=os.defpath), "-c", ask], capture_output=True, text=True).stdout.strip()
    if its != "{}.{}".format(*sys.version_info):
        pytest.skip(f"qgis_process has Python {its}: run the tests with that")
    site = tmp_path / "site"
    site.mkdir()
    for name in ("pointfair", "nanobind_backend"):  # whatever else this Python has need not suit that of QGIS
        (site / name).symlink_to(pathlib.Path(importlib.import_module(name).__file__).parent)
    own = {"HOME": tmp_path, "XDG_RUNTIME_DIR": tmp_path, "QGIS_CUSTOM_CONFIG_PATH": tmp_path / "settings",
           "QGIS_PLUGINPATH": FOLDER, "PYTHONPATH": site, "QT_QPA_PLATFORM": "offscreen"}
    own["PATH"] = os.defpath  # QGIS takes the first python3 of the path for its own
    environment = {name: str(value) for name, value in own.items()}

    def run(*words):
        return subprocess.run([program, *words], env=environment, capture_output=True, text=True, timeout=300)

    assert "* pointfair_provider" in run("plugins", "enable", "pointfair_provider").stdout
    return run


def test_qgis_process_writes_what_the_library_writes(qgis_process, scan, tmp_path):
    output = tmp_path / "out.ply"
    ended = qgis_process("run", "pointfair:denoise", f"--INPUT={scan}", "--NOISE=0.01", "--OUTLIERS=1", f"--OUTPUT={output}")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "POINTS:\t3000\nUNMOVED:\t0\n" in ended.stdout
    pf.read(scan).denoise(noise=0.01, outliers="keep").write(tmp_path / "expected.ply")
    assert output.read_bytes() == (tmp_path / "expected.ply").read_bytes()


def test_qgis_process_keeps_a_las_file_but_for_the_coordinates_that_moved(qgis_process, tmp_path):
    classes = np.where(np.arange(3000) % 3 == 0, 2, 6).astype(np.uint8)
    pf.Cloud(waves(3000) + [500000, 5400000, 100], {"classification": classes}).write(tmp_path / "tile.las")
    given = [f"--INPUT={tmp_path / 'tile.las'}", "--WHERE=classification=6", f"--OUTPUT={tmp_path / 'out.las'}"]
    ended = qgis_process("run", "pointfair:denoise", *given)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    before, after = pf.read(tmp_path / "tile.las"), pf.read(tmp_path / "out.las")
    before.denoise(where="classification=6").write(tmp_path / "expected.las")
    assert (tmp_path / "out.las").read_bytes() == (tmp_path / "expected.las").read_bytes()
    moved = (before.xyz != after.xyz).any(1)
    assert 1500 < moved.sum() <= 2000 and not moved[classes == 2].any() and np.array_equal(after["classification"], classes)


def test_qgis_process_tells_a_fault_in_one_line(qgis_process, tmp_path):
    missing, output = tmp_path / "missing.laz", tmp_path / "out.ply"
    ended = qgis_process("run", "pointfair:denoise", f"--INPUT={missing}", f"--OUTPUT={output}")
    lines = [line for line in (ended.stdout + ended.stderr).splitlines() if str(missing) in line and "ERROR" in line.upper()]
    assert ended.returncode != 0 and len(lines) == 1 and not output.exists()


def test_the_metadata_has_what_a_plugin_needs():
    parser = configparser.ConfigParser()
    parser.read(FOLDER / "pointfair_provider/metadata.txt")
    needed = {"name", "qgisminimumversion", "description", "about", "version", "author", "email", "hasprocessingprovider"}
    assert needed <= set(parser["general"]) and parser["general"]["hasProcessingProvider"] == "yes"
    assert parser["general"]["version"] == pf.__version__
