"use strict";
// [address, title, text] of each section of the site and of each name of the reference
const entries = [/* entries */];
const field = document.getElementById("search"), found = document.getElementById("found");
const MOST = 12;

function rank([, title, text], words) {
  // every word must occur; in a title it counts more, as the last part of a dotted name most
  let sum = 0;
  for (const word of words) {
    const named = title.toLowerCase(), at = text.toLowerCase().indexOf(word);
    if (named.split(/[ .:]+/).includes(word)) sum += 20;
    else if (named.includes(word)) sum += 10;
    else if (at >= 0) sum += 1;
    else return 0;
  }
  return sum - title.length / 1000;
}

function show() {
  const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
  const ranked = words.length ? entries.map(entry => [rank(entry, words), entry]).filter(([sum]) => sum > 0) : [];
  ranked.sort((a, b) => b[0] - a[0]);
  found.replaceChildren(...ranked.slice(0, MOST).map(([, [address, title]]) => {
    const link = Object.assign(document.createElement("a"), {href: address, textContent: title});
    const item = document.createElement("li");
    item.append(link);
    return item;
  }));
  found.hidden = !words.length;
  if (words.length && !ranked.length) found.textContent = "Nothing was found.";
}

field.addEventListener("input", show);
// a search may be linked to: index.html?q=words
field.value = new URLSearchParams(location.search).get("q") ?? "";
show();
