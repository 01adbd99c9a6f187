"""What meets: triangle meshes, surfaces, and the proxy that follows a tip over them."""

from palpate.touch.contact import Contact, Contacts
from palpate.touch.diagnosis import Diagnosis
from palpate.touch.mesh import Mesh, MeshError
from palpate.touch.proxy import Proxy
from palpate.touch.surface import Surface, SurfaceError

__all__ = ["Contact", "Contacts", "Diagnosis", "Mesh", "MeshError", "Proxy", "Surface", "SurfaceError"]
