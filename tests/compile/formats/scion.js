// A judge of SCXML: reads {text, events} on standard input, one object a line, and writes for each
// what is active at first and after each event, by SCION.
//
// $ npm install --no-save @scion-scxml/scxml@4.3.27
const readline = require("readline");
const { core, documentStringToModel } = require("@scion-scxml/scxml");

function statechart(text) {
  return new Promise((resolve, reject) => {
    documentStringToModel("", text, (error, model) => {
      if (error) return reject(error);
      model.prepare((fault, prepared) => {
        if (fault) return reject(fault);
        resolve(new core.Statechart(prepared));
      });
    });
  });
}

async function main() {
  for await (const line of readline.createInterface({ input: process.stdin })) {
    const { text, events } = JSON.parse(line);
    const chart = await statechart(text);
    chart.start();
    const rows = [chart.getConfiguration()];
    for (const event of events) {
      chart.gen({ name: event });
      rows.push(chart.getConfiguration());
    }
    console.log(JSON.stringify(rows));
  }
}

main();
