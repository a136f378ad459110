"""Why answers fail: the one mistake that gives all of them, or nothing.

A fault is one change in a program. So there is one right program, the `specimen`, and one engine that changes it:
`operators` is the table of what people write by mistake, `inputs` of what they put in, and `search` finds the one
change with which the specimen, or one of the other right `ways` of writing it, gives the answers. `relations` are
mistakes of a reader, not of a program; `places` says where wrong answers are. `statement` asks them in turn.
"""

from tippedisk_verify.conformance.diagnosis.statement import Diagnosis, diagnosed

__all__ = ["Diagnosis", "diagnosed"]
