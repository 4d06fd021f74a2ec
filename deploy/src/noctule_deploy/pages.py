"""Whether the pages of a fleet answer: each as a browser asks it that has not logged in."""

import http.client
import ssl

from noctule_deploy.fleet import Web

_PATIENCE_S = 3.0


def trouble(web: Web) -> str:
    """What is wrong with a page, empty where it asks for its login. Its certificate is left to the browsers."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # nothing secret is sent
    connection = http.client.HTTPSConnection(web.name, web.port, context=context, timeout=_PATIENCE_S)
    try:
        connection.request("GET", "/")
        status = connection.getresponse().status
    except (OSError, http.client.HTTPException) as error:
        return f"https://{web.name}:{web.port} does not answer: {error}"
    finally:
        connection.close()
    if status == http.HTTPStatus.UNAUTHORIZED:
        return ""
    return f"does not ask for a login: it answers with status {status}"
