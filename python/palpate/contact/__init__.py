"""Contact of a tip with triangle meshes: meshes, surfaces and proxies."""

from palpate.contact.diagnosis import Diagnosis
from palpate.contact.mesh import Mesh, MeshError
from palpate.contact.proxy import Contact, Contacts, Proxy
from palpate.contact.surface import Surface, SurfaceError

__all__ = ["Contact", "Contacts", "Diagnosis", "Mesh", "MeshError", "Proxy", "Surface", "SurfaceError"]
