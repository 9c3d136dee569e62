"""The policy of a page: its own style and script by their hashes, and nothing else at all.

https://www.w3.org/TR/CSP3/
"""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256


def content_security_policy(style: str, script: str = "") -> str:
    """The content of the policy's meta element.

    Args:
        script: Exactly what stands in the script element; a page without one runs none.
    """
    scripts = _source(script) if script else "'none'"
    return (
        f"default-src 'none'; style-src {_source(style)}; script-src {scripts}; "
        "base-uri 'none'; form-action 'none'"
    )


def _source(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
