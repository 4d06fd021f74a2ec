"""The Caddyfile of a page: TLS and login in front of the relay, page and data under one name, for reading only."""

from urllib.parse import quote

from noctule_deploy.fleet import Viewer, Web, bracketed

_SERVICE = "/rerun.sdk_comms.v1alpha1.MessageProxyService"
_READS = f"{_SERVICE}/ReadMessages {_SERVICE}/ReadTables"
_ALL_CALLS = "/rerun.*"  # writing ones, and those of other services that a relay may have


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
		@bare {{
			path /
			not query url=*
		}}
		redir @bare /?url={relay}
		@reads path {_READS}
		reverse_proxy @reads h2c://127.0.0.1:{viewer.port} {{
			flush_interval -1
		}}
		@calls path {_ALL_CALLS}
		respond @calls "Who watches may not write." 403
		reverse_proxy 127.0.0.1:{viewer.web_port}
	}}
}}
"""
