# SPDX-License-Identifier: Apache-2.0
"""A plugin of QGIS 3.16 and later with a processing provider, for the toolbox, models, batches and qgis_process:

    python3 -m pip install pointfair-0.1.0-cp310-abi3-manylinux_2_35_x86_64.whl      (the Python of QGIS)
    cp -r pointfair_provider ~/.local/share/QGIS/QGIS3/profiles/default/python/plugins/
    qgis_process plugins enable pointfair_provider
    qgis_process run pointfair:denoise --INPUT=tile.laz --OUTPUT=tile_denoised.laz

Where the Python of QGIS is that of the system, as on Debian and Ubuntu, pip wants --user --break-system-packages: it adds
pointfair and nanobind-backend to your own folder and leaves the packages of the system as they are.
"""
from qgis.core import QgsApplication

from .provider import Provider


class Plugin:
    """Adds the provider to QGIS, and takes it away."""

    def __init__(self):
        self.provider = None

    def initProcessing(self):  # all that qgis_process calls
        self.provider = Provider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self):
        self.initProcessing()

    def unload(self):
        QgsApplication.processingRegistry().removeProvider(self.provider)


def classFactory(iface):
    return Plugin()
