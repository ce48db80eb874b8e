"""Standard Input Data of flexible bodies: reading, writing, and conversion from and to bodies of scenes."""

from flexmb.interchange.sid.blocks import Sid as Sid
from flexmb.interchange.sid.blocks import SidError as SidError
from flexmb.interchange.sid.blocks import SidNode as SidNode
from flexmb.interchange.sid.blocks import Taylor as Taylor
from flexmb.interchange.sid.files import read_sid as read_sid
from flexmb.interchange.sid.files import write_sid as write_sid
from flexmb.interchange.sid.from_body import sid_of as sid_of
from flexmb.interchange.sid.to_body import ImportedSid as ImportedSid
from flexmb.interchange.sid.to_body import imported_sid as imported_sid
from flexmb.interchange.sid.to_body import with_sid_bodies as with_sid_bodies
