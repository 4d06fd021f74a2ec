"""The Caddyfile of a page: TLS and login in front of the relay, page and data under one name, for reading only."""

from urllib.parse import quote

from noctule_deploy.fleet import Viewer, Web, bracketed

_DATA = "/rerun.sdk_comms.v1alpha1.*"
_WRITES = "/rerun.sdk_comms.v1alpha1.MessageProxyService/Write*"


def caddyfile(viewer: Viewer, web: Web) -> str:
    """The configuration of Caddy for a viewer's page."""
    users = "".join(f"\t\t\t{name} {hashed}\n" for name, hashed in web.users.items())
    origin = f"https://{bracketed(web.name)}:{web.port}"
    relay = quote(f"rerun+{origin}/proxy", safe="")
    vouched = "" if web.certificate == "acme" else "\ttls internal\n"
    return f"""\
# Made by noctule-deploy render. Change the fleet file, not this file.
{{
	admin off
	skip_install_trust
	auto_https disable_redirects
}}

{origin} {{
{vouched}\
	# In this order, and the login first: Caddy's own would answer some requests before it.
	route {{
		basicauth {{
{users}\
		}}
		@writes path {_WRITES}
		respond @writes "Who watches may not write." 403
		@bare {{
			path /
			not query url=*
		}}
		redir @bare /?url={relay}&theme=dark&hide_welcome_screen
		@data path {_DATA}
		reverse_proxy @data h2c://127.0.0.1:{viewer.port} {{
			flush_interval -1
		}}
		reverse_proxy 127.0.0.1:{viewer.web_port}
	}}
}}
"""
