// The copy button of a console block copies its commands: no prompts, and nothing that they print.
document.addEventListener("click", (event) => {
  const block = event.target.closest(".highlight");
  const button = event.target.closest("[data-clipboard-target]");
  if (!block || !button || !block.querySelector(".gp")) return;
  const commands = [];
  let running = false;
  for (const line of block.querySelector("code").textContent.split("\n")) {
    if (line.startsWith("$ ")) commands.push(line.slice(2));
    else if (running && line.startsWith("> ")) commands.push(line.slice(2));
    else { running = false; continue; }
    running = true;
  }
  button.setAttribute("data-clipboard-text", commands.join("\n"));
}, true);
