# SPDX-License-Identifier: Apache-2.0
"""The provider and its algorithm: a file in, a file out, as `pointfair run` has it."""
from __future__ import annotations

import warnings

import numpy as np
from qgis.core import (QgsProcessingAlgorithm, QgsProcessingException, QgsProcessingOutputNumber,
                       QgsProcessingParameterEnum, QgsProcessingParameterFile, QgsProcessingParameterFileDestination,
                       QgsProcessingParameterNumber, QgsProcessingParameterString, QgsProcessingProvider)

OUTLIERS = ["auto", "keep", "mark", "move", "off"]
FILES = "Point clouds (*.las *.laz *.copc.laz *.e57 *.ply *.pcd *.xyz *.txt *.csv *.pts *.ptx)"


class Canceled(Exception):
    """Somebody pressed Cancel."""


class Denoise(QgsProcessingAlgorithm):
    """Denoise a point cloud."""

    def name(self):
        return "denoise"

    def displayName(self):
        return "Denoise a point cloud"

    def shortHelpString(self):
        return ("Moves points onto their surface and keeps edges. The output has all points, in their order, and all attributes. "
                "The noise is estimated from place to place unless it is given, in the unit of the coordinates.")

    def createInstance(self):
        return Denoise()

    def initAlgorithm(self, configuration=None):
        number = QgsProcessingParameterNumber.Double
        self.addParameter(QgsProcessingParameterFile("INPUT", "Point cloud", fileFilter=FILES))
        self.addParameter(QgsProcessingParameterNumber("NOISE", "Standard deviation of the noise; empty: estimated", number,
                                                       optional=True, minValue=0))
        self.addParameter(QgsProcessingParameterNumber("STRENGTH", "Strength; 0 is the input, 1 the result", number,
                                                       defaultValue=1, minValue=0, maxValue=1))
        self.addParameter(QgsProcessingParameterString("WHERE", "Only points that move, as in classification=2,6", optional=True))
        self.addParameter(QgsProcessingParameterEnum("OUTLIERS", "Outliers", OUTLIERS, defaultValue=0))
        self.addParameter(QgsProcessingParameterFileDestination("OUTPUT", "Denoised", fileFilter=FILES))
        self.addOutput(QgsProcessingOutputNumber("POINTS", "Points"))
        self.addOutput(QgsProcessingOutputNumber("UNMOVED", "Points that kept their place"))

    def processAlgorithm(self, parameters, context, feedback):
        try:
            import pointfair as pf
        except ImportError:
            raise QgsProcessingException("pointfair is not installed in the Python of QGIS: install its wheel there with pip") from None
        output = self.parameterAsFileOutput(parameters, "OUTPUT", context)
        chosen = {"outliers": OUTLIERS[self.parameterAsEnum(parameters, "OUTLIERS", context)]}
        if parameters.get("NOISE") is not None:
            chosen["noise"] = self.parameterAsDouble(parameters, "NOISE", context)

        def show(share, stage):
            feedback.setProgress(100 * share)
            if feedback.isCanceled():
                raise Canceled

        try:
            cloud = pf.read(self.parameterAsFile(parameters, "INPUT", context))
            smooth, report = pf.denoise(cloud, where=self.parameterAsString(parameters, "WHERE", context) or None,
                                        strength=self.parameterAsDouble(parameters, "STRENGTH", context),
                                        return_report=True, progress=show, **chosen)
            with warnings.catch_warnings(record=True) as losses:
                warnings.simplefilter("always")
                smooth.write(output, overwrite=True)
        except Canceled:
            return {}
        except pf.Error as error:
            raise QgsProcessingException(str(error)) from error
        for loss in losses:
            feedback.pushWarning(str(loss.message))
        unmoved = int(((smooth.xyz == cloud.xyz) | np.isnan(cloud.xyz)).all(axis=1).sum())  # by WHERE, too
        noise = f"{chosen['noise']:.4g} (given)" if "noise" in chosen else f"{report.noise:.4g} (estimated)"
        feedback.pushInfo(f"{report.points} points, {unmoved} kept their place; noise {noise}")
        return {"OUTPUT": output, "POINTS": report.points, "UNMOVED": unmoved}


class Provider(QgsProcessingProvider):
    """What the toolbox lists under pointfair."""

    def id(self):
        return "pointfair"

    def name(self):
        return "pointfair"

    def loadAlgorithms(self):
        self.addAlgorithm(Denoise())
