// Lists the released versions of this site, which lie beside it, and leads to the first page of the one that is chosen.
{
  const select = document.getElementById("version");
  const here = decodeURIComponent(location.pathname.split("/").at(-2));
  for (const one of VERSIONS) select.add(new Option(one, one, one === here, one === here));
  select.hidden = false;
  select.addEventListener("change", () => location.assign(`../${encodeURIComponent(select.value)}/index.html`));
}
