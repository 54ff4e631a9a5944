"""Makes the meshes of this folder with Gmsh: `pip install gmsh`, then `python make_meshes.py`.

See README.md for what they are.
"""

import math

import gmsh


def surfaces_at(centre_of):
    """Physical groups: a name for every surface, by its centre of mass."""
    groups = {}
    for _, tag in gmsh.model.getEntities(2):
        groups.setdefault(centre_of(gmsh.model.occ.getCenterOfMass(2, tag)), []).append(tag)
    for name, tags in sorted(groups.items()):
        gmsh.model.addPhysicalGroup(2, tags, name=name)
    gmsh.model.addPhysicalGroup(3, [t for _, t in gmsh.model.getEntities(3)], name="body")


def save(name, version, binary):
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", int(binary))
    gmsh.write(name)
    gmsh.model.remove()


def cylinder(name, radius, length, angle, h, binary):
    """Tetrahedra of size h in a sector of a cylinder along z."""
    gmsh.model.add(name)
    gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, length, radius, angle=angle)
    gmsh.model.occ.synchronize()

    def face(c):
        x, y, z = c
        if abs(z) < 1e-6:
            return "bottom"
        if abs(z - length) < 1e-6:
            return "top"
        if angle < 2 * math.pi and min(abs(x), abs(y)) < 1e-6:
            return "end" if abs(x) < 1e-6 else "start"
        return "side"

    surfaces_at(face)
    gmsh.option.setNumber("Mesh.MeshSizeMin", h)
    gmsh.option.setNumber("Mesh.MeshSizeMax", h)
    gmsh.option.setNumber("Mesh.Algorithm3D", 1)
    gmsh.option.setNumber("Mesh.OptimizeNetgen", 1)
    gmsh.model.mesh.generate(3)
    save(name, 4.1, binary)


def cube(name, n, hexahedra):
    gmsh.model.add(name)
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()

    def face(c):
        for axis in range(3):
            for side in (0, 1):
                if abs(c[axis] - side) < 1e-6:
                    return "xyz"[axis] + ("_min", "_max")[side]
        raise AssertionError(c)

    surfaces_at(face)
    if hexahedra:
        for _, tag in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(tag, n + 1)
        for _, tag in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(tag)
            gmsh.model.mesh.setRecombine(2, tag)
        gmsh.model.mesh.setTransfiniteVolume(gmsh.model.getEntities(3)[0][1])
    else:
        gmsh.option.setNumber("Mesh.MeshSizeMin", 1 / n)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1 / n)
    gmsh.model.mesh.generate(3)
    save(name, 2.2, False)


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
for name, h, binary in [("bar_1.msh", 1.3, False), ("bar_2.msh", 0.95, True), ("bar_3.msh", 0.72, True)]:
    cylinder(name, 3.2, 32.4, math.pi / 2, h, binary)
cylinders = [0.23, 0.17, 0.138, 0.11]
for name, h in [(f"cylinder_{i + 1}.msh", h) for i, h in enumerate(cylinders)]:
    cylinder(name, 0.5, 3, 2 * math.pi, h, True)
cube("cube_tetrahedra.msh", 6, False)
cube("cube_hexahedra.msh", 6, True)
gmsh.finalize()
