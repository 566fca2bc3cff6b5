# SPDX-License-Identifier: Apache-2.0
"""An add-on for Blender 4.2 and later: Object > Denoise with pointfair moves the vertices of a mesh, or the points of a
point cloud, onto their surface.

Install pointfair into Blender's own Python, then this file with Edit > Preferences > Add-ons > Install from Disk:

    BLENDER/5.0/python/bin/python3.11 -m pip install pointfair-0.1.0-cp311-cp311-manylinux_2_28_x86_64.whl
"""
import bpy
import numpy as np

bl_info = {
    "name": "Denoise with pointfair",
    "author": "pointfair",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "Object > Denoise with pointfair",
    "description": "Removes the noise of 3D scans and keeps their shape",
    "category": "Object",
}


def positions_of(data):
    """The (N, 3) float32 positions of a mesh or a point cloud."""
    xyz = np.empty(3 * len(data.attributes["position"].data), np.float32)
    data.attributes["position"].data.foreach_get("vector", xyz)
    return xyz.reshape(-1, 3)


def triangles_of(mesh):
    """The (F, 3) corners of its faces as triangles."""
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    return corners.reshape(-1, 3)


class OBJECT_OT_pointfair_denoise(bpy.types.Operator):
    """Remove the noise of the active mesh or point cloud, and keep its shape"""

    bl_idname = "object.pointfair_denoise"
    bl_label = "Denoise with pointfair"
    bl_options = {"REGISTER", "UNDO"}

    noise: bpy.props.FloatProperty(name="Noise", description="Standard deviation of the noise, in the object's own units; 0: estimated",
                                   default=0.0, min=0.0, precision=5)
    iterations: bpy.props.IntProperty(name="Iterations", description="How often points move; 0: chosen from the data",
                                      default=0, min=0, max=100)
    strength: bpy.props.FloatProperty(name="Strength", description="0 is the input, 1 the result", default=1.0, min=0.0, max=1.0)
    use_faces: bpy.props.BoolProperty(name="Along Faces", default=True,
                                      description="Neighbours are those along the faces, and folded faces unfold; where there are faces")

    @classmethod
    def poll(cls, context):
        active = context.active_object
        holds_points = active is not None and active.type in {"MESH", "POINTCLOUD"} and active.mode == "OBJECT"
        return holds_points and "position" in active.data.attributes  # empty ones have none

    def execute(self, context):
        try:
            import pointfair as pf
        except ImportError:
            self.report({"ERROR"}, "pointfair is not installed in Blender's Python: the add-on's file says how")
            return {"CANCELLED"}
        data = context.active_object.data
        if context.active_object.type == "MESH" and data.shape_keys:
            self.report({"ERROR"}, "the object has shape keys, which hold its shape in place of the mesh: apply or remove them first")
            return {"CANCELLED"}
        parameters = {"strength": self.strength}
        if self.noise > 0:
            parameters["noise"] = self.noise
        if self.iterations > 0:
            parameters["iterations"] = self.iterations
        faces = triangles_of(data) if self.use_faces and context.active_object.type == "MESH" else ()
        if len(faces) > 0:
            parameters.update(faces=faces, connectivity="mesh")
        try:
            moved, report = pf.denoise(positions_of(data), return_report=True, **parameters)
        except pf.Error as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        data.attributes["position"].data.foreach_set("vector", moved.ravel())
        data.update_tag()
        if context.active_object.type == "MESH":
            data.update()
        told = f"{report.points} points denoised, {report.unmoved.total} kept as they were; noise {report.noise:.4g}"
        if context.active_object.type == "MESH" and data.has_custom_normals:  # of the noisy surface, as importers set them
            bpy.ops.mesh.customdata_custom_splitnormals_clear()
            told += "; the normals of the input were removed, Blender computes them"
        self.report({"INFO"}, told)
        return {"FINISHED"}


def draw_entry(menu, context):
    menu.layout.operator(OBJECT_OT_pointfair_denoise.bl_idname)


def register():
    bpy.utils.register_class(OBJECT_OT_pointfair_denoise)
    bpy.types.VIEW3D_MT_object.append(draw_entry)


def unregister():
    bpy.types.VIEW3D_MT_object.remove(draw_entry)
    bpy.utils.unregister_class(OBJECT_OT_pointfair_denoise)


if __name__ == "__main__":
    register()
