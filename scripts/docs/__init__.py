"""The documentation as a site: `scripts/site` builds it with mkdocs, of docs/ and of the code."""
